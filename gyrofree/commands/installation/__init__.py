"""Commands about one installation: what it is set to, and whether it is well."""
