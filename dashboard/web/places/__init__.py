"""Who is there: sites, services, boards and people, on a page and by REST."""
