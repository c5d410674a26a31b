"""The first visit: no board yet, and an administrator who came by a one-time link."""
