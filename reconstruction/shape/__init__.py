"""The garment's shape: its pattern sewn, put on a figure made from the landmarks, and drawn to what the pictures show."""
