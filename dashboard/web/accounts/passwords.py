"""What a password may be: long, and not one of those that are tried first.

No rule of composition: length is what counts. What is tried first is found by how it is made (words
that everybody takes, runs on the keyboard, few characters again and again), whatever digits and
signs are put around it: a list of whole passwords would know only itself.
"""

import re

PASSWORD_MIN = 12  # characters
PASSWORD_MAX = 256  # characters; argon2 would take any length, and any time
DISTINCT = 5  # different characters, at least

_WORDS = (
    "password passwort passwd pass kennwort parola secret geheim login welcome willkommen hello"
    " hallo letmein please bitte master admin administrator root user guest test testing demo"
    " default changeme change access system server computer internet service support manager"
    " operator viewer gyrofree gyro free dashboard bench sensor cube table gateway iloveyou love"
    " lover baby babygirl angel princess sunshine shadow dragon monkey tiger superman batman"
    " football baseball basketball soccer hockey michael jennifer thomas daniel charlie jordan"
    " summer winter spring autumn sommer january february march april may june july august"
    " september october november december monday friday sunday my me is the and for you new one"
    " qwerty qwertz azerty asdf zxcv abc xyz trustno starwars pokemon whatever freedom flower"
    " cheese chocolate banana orange cookie killer hunter ranger money lucky happy forever"
)
_COMMON = re.compile(f"(?:{'|'.join(sorted(_WORDS.split(), key=len, reverse=True))})*")
_RUNS = ("abcdefghijklmnopqrstuvwxyz", "01234567890", "qwertyuiop", "asdfghjkl", "zxcvbnm")
_RUNS += ("qwertzuiop", "yxcvbnm", "azertyuiop", "1qaz2wsx3edc4rfv5tgb6yhn7ujm8ik9ol0p")
_DISGUISE = str.maketrans("013457@$!€", "oleastasie")


def fault_of(password: str, name: str) -> str:
    """Why this cannot be the password of that user, in words to show; empty when it can."""
    if not PASSWORD_MIN <= len(password) <= PASSWORD_MAX:
        return f"password has {len(password)} characters: want {PASSWORD_MIN} to {PASSWORD_MAX}"
    small = password.lower()
    if small == name.lower():
        return "password equals the user name: choose another"
    if len(set(small)) < DISTINCT:
        return f"password is made of fewer than {DISTINCT} different characters: choose another"
    if _is_run(small) or _is_common(small, name.lower()):
        return (
            "password is one of those that are tried first (common words, the user's name, runs of"
            " the keyboard): choose another, as four or five words of your own"
        )
    return ""


def _is_run(small: str) -> bool:
    """Pieces of four and more that stand so on the keyboard or in the alphabet, one after the
    other, and little else.
    """
    left = len(small)
    k = 0
    while k < len(small):
        long = max(_run_at(small[k:]), _run_at_back(small[k:]))
        if long >= 4:
            left -= long
        k += long if long >= 4 else 1
    return left <= 4


def _run_at(text: str) -> int:
    """How many characters of its beginning follow one another in a run."""
    long = 0
    while long < len(text) and any(text[: long + 1] in run for run in _RUNS):
        long += 1
    return long


def _run_at_back(text: str) -> int:
    long = 0
    while long < len(text) and any(text[: long + 1][::-1] in run for run in _RUNS):
        long += 1
    return long


def _is_common(small: str, name: str) -> bool:
    """Nothing but common words and the name, with whatever digits and signs in between."""
    bare = re.sub(r"^[\W\d_]+|[\W\d_]+$", "", small)
    for text in (small, bare.translate(_DISGUISE)):
        letters = re.sub(r"[\W\d_]+", "", text)
        own = re.sub(r"[\W\d_]+", "", name)
        if len(own) >= 3:
            letters = letters.replace(own, "")
        if letters and _COMMON.fullmatch(letters) and len(letters) > 2:
            return True
        if not letters and re.search(r"[^\W\d_]", text):
            return True  # only the name was left
    return False
