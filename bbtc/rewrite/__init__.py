"""From trees to trees that do the same, or no worse, with fewer nodes."""
