"""The map under the tracks: tiles from one file on disk, and where things are on them."""
