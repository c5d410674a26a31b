"""One file per kind of device: which messages come in, which estimators see them, what goes out."""
