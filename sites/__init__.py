"""Several places that work as one site: who may come, by which certificate, and what he may say.

place.py        the folder of a place: who it is, its peers, its files
authority.py    the site's own certificate authority, and the register of what it issued
roles.py        what each role may say on the bus, from the table of topics
access.py       the same as the router's rules, by common name, denied by default
invitation.py   a line of text that lets one other place join, once
enrolment.py    both ends of joining, and of renewing what has become old
check.py        tries what each certificate may do, and says where that differs from the rules
"""
