"""The page at `/`: modules and styles that the browser loads, and what they need of a site as GeoJSON."""
