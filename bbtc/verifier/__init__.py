"""Independent recomputation: trees and tasks as programs in the PRISM language, and their solution."""
