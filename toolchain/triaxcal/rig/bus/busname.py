"""Values of --bus with options: what they say, whoever opens it."""

from __future__ import annotations

import re

from triaxcal.base.errors import UsageError
from triaxcal.base.tomltable import shown

_OPTION = re.compile(r",(?=[A-Za-z_]\w*=)")


def channel_and_options(text: str, form: str) -> tuple[str, dict[str, str]]:
    """Channel and options of "channel,option=value,...".

    A comma belongs to the channel where no option follows it, as in "0,1,bitrate=500000".

    Parameters
    ----------
    form : str
        What is expected, for the message.

    Raises
    ------
    UsageError
        When an option is given twice.
    """
    channel, *given = _OPTION.split("," + text if _OPTION.match("," + text) else text)
    options = dict(part.split("=", 1) for part in given)
    if len(options) != len(given):
        raise UsageError("--bus", f"found {shown(text)}, with an option twice", expected=form)
    return channel, options
