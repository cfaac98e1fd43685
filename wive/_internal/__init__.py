"""What wive uses itself: not for import by others, and free to change."""
