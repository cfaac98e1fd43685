"""Lane vectors, their collectives, and native code."""
