"""Accounts: what a password may be, whose sign-ins are open, and who did what."""
