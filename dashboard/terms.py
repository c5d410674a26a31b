"""Words of the trade that stand on the pages, and what they mean; docs/glossary.md has more."""

TERMS = {
    "valid": "Seen by the sensors: the value is within the sigma that is stated.",
    "ambiguous": "Its size is known, its sign is not.",
    "blind": "Below what the sensors can tell: the value is integrated only, and drifts.",
    "NIS": "Normalised innovation squared: how large a filter's surprises are beside what it"
    " expects. In an honest filter it is on the average its degrees of freedom; above, the filter"
    " is too sure of itself, below, too careful.",
    "GDOP": "Geometric dilution of precision: how much the arrangement of the sensors spreads their"
    " noise. Smaller is better.",
    "bound": "Cram\u00e9r-Rao bound: no filter with this model and these sensors can be surer.",
}


def glossary_link(word: str) -> str:
    """Where the word stands on the page of words."""
    return f"/words#{word.lower()}"
