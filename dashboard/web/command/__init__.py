"""The command of the site and the orders that were given, as pages and REST."""
