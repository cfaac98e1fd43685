"""Text of files in messages."""


def one_line(text: str) -> str:
    """The text on one line, with escapes in place of characters that would break it or the terminal."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)
