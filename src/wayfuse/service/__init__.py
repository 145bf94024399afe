"""The live server: phones and anchors in, positions out."""
