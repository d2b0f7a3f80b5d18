"""From a plan to C text and a binary image; compiling them; checking them against Python."""
