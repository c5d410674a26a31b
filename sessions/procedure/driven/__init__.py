"""Tables that are driven: their text commands, the line to them, and what stops them."""
