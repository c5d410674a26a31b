"""The front door: pages, API, users, the proxy to the scene."""
