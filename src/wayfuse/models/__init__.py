"""The glue between one domain and one seam of the filter."""
