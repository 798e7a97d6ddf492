"""The formats of recordings: each module reads messages from the files of one format."""
