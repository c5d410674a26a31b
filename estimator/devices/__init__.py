"""All estimators of one device, side by side on the same samples."""
