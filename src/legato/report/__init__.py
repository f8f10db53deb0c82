"""Pages and figures made from records: the report of a session, and its score against the truth.

Reads records and nothing else; matplotlib and jinja2 are imported where they are used.
"""
