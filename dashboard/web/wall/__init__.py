"""The wall display: one page for a screen that nobody touches, under a sign-in of its own."""
