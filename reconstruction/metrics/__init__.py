"""How near a restored garment comes to a known one: distances, normals, folds, features."""
