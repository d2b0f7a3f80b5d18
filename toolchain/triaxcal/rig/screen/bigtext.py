"""Letters of five rows, two rows to a line of the terminal: to be read from two metres."""

from __future__ import annotations

from types import MappingProxyType

_ROWS = 5
_GLYPHS = MappingProxyType(
    {
        "A": ".#. #.# ### #.# #.#",
        "B": "##. #.# ##. #.# ##.",
        "C": ".## #.. #.. #.. .##",
        "D": "##. #.# #.# #.# ##.",
        "E": "### #.. ##. #.. ###",
        "F": "### #.. ##. #.. #..",
        "G": ".## #.. #.# #.# .##",
        "H": "#.# #.# ### #.# #.#",
        "I": "### .#. .#. .#. ###",
        "J": "..# ..# ..# #.# .#.",
        "K": "#.# #.# ##. #.# #.#",
        "L": "#.. #.. #.. #.. ###",
        "M": "#...# ##.## #.#.# #...# #...#",
        "N": "#..# ##.# #.## #..# #..#",
        "O": "### #.# #.# #.# ###",
        "P": "##. #.# ##. #.. #..",
        "Q": ".#. #.# #.# ##. .##",
        "R": "##. #.# ##. #.# #.#",
        "S": ".## #.. .#. ..# ##.",
        "T": "### .#. .#. .#. .#.",
        "U": "#.# #.# #.# #.# ###",
        "V": "#.# #.# #.# #.# .#.",
        "W": "#...# #...# #.#.# ##.## #...#",
        "X": "#.# #.# .#. #.# #.#",
        "Y": "#.# #.# .#. .#. .#.",
        "Z": "### ..# .#. #.. ###",
        "0": "### #.# #.# #.# ###",
        "1": ".#. ##. .#. .#. ###",
        "2": "##. ..# .#. #.. ###",
        "3": "### ..# .## ..# ###",
        "4": "#.# #.# ### ..# ..#",
        "5": "### #.. ##. ..# ##.",
        "6": ".## #.. ### #.# ###",
        "7": "### ..# .#. .#. .#.",
        "8": "### #.# ### #.# ###",
        "9": "### #.# ### ..# ##.",
        "+": "... .#. ### .#. ...",
        "-": "... ... ### ... ...",
        ".": ". . . . #",
        "/": "..# ..# .#. #.. #..",
        " ": ". . . . .",
    }
)
"""Five rows of each letter, `#` is ink."""
_BLOCKS = MappingProxyType({(0, 0): " ", (1, 0): "▀", (0, 1): "▄", (1, 1): "█"})


def big(text: str, width: int, scale: int) -> list[str]:
    """Lines of a text in big letters, of the largest scale up to `scale` that fits into `width`.

    Raises
    ------
    KeyError
        When a letter is not among the upper case, digits and + - . / that there are.
    """
    rows = [".".join(_GLYPHS[letter].split()[row] for letter in text) for row in range(_ROWS)]
    # Blocks are half a line high and one column wide, which is about square.
    times = max(1, min(scale, width // len(rows[0])))
    ink = [
        [cell == "#" for cell in row for _ in range(times)] for row in rows for _ in range(times)
    ]
    ink += [[False] * len(ink[0])] * (len(ink) % 2)
    pairs = zip(ink[0::2], ink[1::2], strict=True)
    return ["".join(_BLOCKS[a, b] for a, b in zip(*pair, strict=True)) for pair in pairs]
