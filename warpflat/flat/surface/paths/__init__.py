"""Lines on a surface: along edges, across faces, geodesic, in a plane."""
