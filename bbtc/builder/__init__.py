"""Building a project: every artefact of its manifest, and only those that are out of date."""
