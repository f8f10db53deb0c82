"""From pixels to named marks. Pure: arrays and bytes in, marks out."""
