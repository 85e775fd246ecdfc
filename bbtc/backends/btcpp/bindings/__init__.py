"""Bindings: actions and conditions of a domain as nodes, actions, services and topics that others have."""
