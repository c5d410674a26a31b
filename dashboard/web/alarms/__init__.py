"""Alarms on a page of their own, and by REST."""
