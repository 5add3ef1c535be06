"""mocapflow: motion capture of people in loose clothes."""
