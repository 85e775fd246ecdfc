"""Code that exported files carry with them. Real modules: type-checked and tested as they stand."""
