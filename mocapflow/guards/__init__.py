"""What plugins provide and components answer, looked at where it comes in."""
