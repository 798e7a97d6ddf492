"""Where the SQL of users runs: over files that can only be read, in a process without rights and within limits."""
