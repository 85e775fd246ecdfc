"""From tasks with hidden facts to tasks whose conditions read knowledge only."""
