"""Ground tasks and the stage that makes them."""
