"""GET /metrics: for a Prometheus server that shows an API token."""

from typing import Annotated

from fastapi import APIRouter, Depends, HTTPException, Request
from fastapi.responses import Response

from dashboard.web.front import Asker, asker, front_of

routes = APIRouter()
SignedIn = Annotated[Asker, Depends(asker)]


@routes.get("/metrics", include_in_schema=False)
def metrics(request: Request, who: SignedIn) -> Response:
    """Figures of all services as the dashboard hears them, and of itself."""
    try:
        # here: the pages do without the package
        from dashboard.web.programs.figures import text
    except ImportError:
        raise HTTPException(501, "the package prometheus-client is not installed here") from None
    streams = request.app.state.listeners.total()
    content, kind = text(front_of(request), streams, request.headers.get("accept", ""))
    return Response(content, media_type=kind)
