"""Sessions are found, labelled, compared and removed."""
