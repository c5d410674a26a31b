"""Names and texts that somebody might send to break what shows them."""

HOSTILE = (
    "<script>window.hit=1</script>",
    "\"><img src=x onerror='window.hit=1'>",
    "'><svg onload=window.hit=1>",
    "</style></p></div><iframe srcdoc='<script>parent.hit=1</script>'></iframe>",
    "[x](javascript:window.hit=1)",
    '![x](x"onerror="window.hit=1)',
    "`${window.hit=1}` ```html\n<b>x</b>\n```",
    "{{ 7*7 }} {% raw %} ${7*7} %s %n {0.__class__}",
    "a\u202etxt.exe\u2066b\u2069",
    "ad\u200bm\u200di\u2060n\ufeff",
    "\x1b[2J\x1b]0;hit\x07\x9b31m\x00\x7f",
    "line\nbreak\r\nX-Header: 1\ttab",
    "z" + "\u0301\u0489" * 40 + "algo",
    '=HYPERLINK("http://127.0.0.1";"x")',
    "&lt;b&gt; &amp;quot; &#x3c;script&#x3e;",
    "[bold red]rich[/] [link=file:///etc/passwd]x[/link]",
    "x" * 10_000,
)
