"""viser's page, and the policy it is served with: its own scripts run, by their hashes, and no
others.

The page is one file that unpacks itself: a script in it decompresses the program, which its
attribute `data-p` carries (base 88, zstd), and adds that to the page as a second script. Both are
known beforehand, so both get a hash, and text that somebody else has brought into the page (an
event handler, a script element) does not run. What has to stay open, and why:

    style-src 'unsafe-inline'     the page's libraries write style elements and attributes
    script-src 'wasm-unsafe-eval' it decompresses by WebAssembly. Texts are not evaluated: that is
                                  wanted by a part for splats, which we do not draw, and by
                                  viser's run_javascript, which we do not call. That part asks as
                                  soon as the page is there, and would leave an error in the console
                                  of every visitor: NO_TEXTS answers it before the policy has to
    blob: of script and worker    its workers are made of texts within the program
    img-src data: blob:           pictures and textures within its messages
"""

import base64
import hashlib
import logging
import re
from functools import cache
from pathlib import Path

import numpy as np
import viser
import zstandard

log = logging.getLogger(__name__)

NO_TEXTS = (
    b"<script>window.Function=new Proxy(Function,{apply:()=>()=>()=>{throw new Error("
    b'"texts are not evaluated here")}})</script>'
)
LARGEST = 64 * 1024**2  # bytes of the program
SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script>", re.DOTALL)
PACKED = re.compile(r'data-p="([^"]*)".*?data-ss="(\d+)".*?data-cs="(\d+)"', re.DOTALL)
ALPHABET = (
    "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
)
POLICY = (
    "default-src 'none'; script-src 'wasm-unsafe-eval' blob: {scripts};"
    " style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; worker-src blob:;"
    " connect-src data: blob: {sockets}; base-uri 'none'; form-action 'none';"
    " frame-src 'none'; object-src 'none'; frame-ancestors 'self'"
)


@cache
def scene_page() -> tuple[bytes, str]:
    """The page and its version tag; one file, read once, with NO_TEXTS before its own scripts."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    return page.replace(b"<head>", b"<head>" + NO_TEXTS, 1), viser.__version__


def policy(host: str, secure: bool = False) -> str:
    """The Content-Security-Policy of the page; host as in the request's header. secure: reached by
    https only.
    """
    sockets = f"wss://{host}" if secure else f"ws://{host} wss://{host}"
    return POLICY.format(sockets=sockets, scripts=" ".join(script_hashes()))


@cache
def script_hashes() -> tuple[str, ...]:
    """Of every script in the page, and of the program that it unpacks. A page of another make than
    is known here stays blank, and the log says so.
    """
    page = scene_page()[0].decode()
    scripts = [body.encode() for _, body in SCRIPT.findall(page)]
    try:
        for attributes, _ in SCRIPT.findall(page):
            if packed := PACKED.search(attributes):
                scripts.append(unpacked(packed[1], int(packed[2]), int(packed[3])))
    except (zstandard.ZstdError, ValueError, KeyError) as error:
        log.error("viser %s packs its page in an unknown way: %s", viser.__version__, error)
    return tuple(f"'sha256-{_sha256(script)}'" for script in scripts if script)


def unpacked(text: str, style_bytes: int, program_bytes: int) -> bytes:
    """The program in `data-p`: base 88, five characters for four bytes, then zstd, then the style
    before it. Raises ValueError, ZstdError.
    """
    if not 0 < style_bytes + program_bytes <= LARGEST:
        raise ValueError(f"{style_bytes + program_bytes} bytes of program")
    values = np.full(128, -1, dtype=np.int64)
    values[[ord(character) for character in ALPHABET]] = np.arange(len(ALPHABET))
    digits = values[np.frombuffer(text.encode("ascii"), dtype=np.uint8)]
    if (digits < 0).any():
        raise ValueError("a character that is none of its alphabet")
    whole, rest = divmod(len(digits), 5)
    powers = len(ALPHABET) ** np.arange(4, -1, -1)
    words = (digits[: 5 * whole].reshape(whole, 5) @ powers) & 0xFFFFFFFF
    packed = words.astype(">u4").tobytes()
    if rest:
        value = int(digits[5 * whole :] @ powers[5 - rest :])
        packed += (value % 256 ** (rest - 1)).to_bytes(rest - 1, "big")
    found = zstandard.ZstdDecompressor().decompress(packed, max_output_size=LARGEST)
    if len(found) != style_bytes + program_bytes:
        raise ValueError(f"{len(found)} bytes instead of {style_bytes + program_bytes}")
    return found[style_bytes:]


def _sha256(script: bytes) -> str:
    return base64.b64encode(hashlib.sha256(script).digest()).decode()
