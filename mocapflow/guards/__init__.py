"""What plugins provide and components return, checked where it comes in."""
