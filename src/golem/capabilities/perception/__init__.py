"""Finding objects: images and query words in, labelled objects with positions out."""
