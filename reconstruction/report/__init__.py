"""The report of a restored garment: one HTML file with pictures, tables, figures and models that turn, without a network."""
