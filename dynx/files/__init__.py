"""Files that users name: bounded reading and atomic writing, documents and their schemas, and reports."""
