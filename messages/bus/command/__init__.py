"""The command of a site: who may order now, kept at one place of the bus, and what was ordered."""
