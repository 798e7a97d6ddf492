"""What continuous integration takes: which incidents fail, and the same as SARIF and JUnit."""
