"""Motion becomes a picture: the scene and charts behind one front door."""
