"""Who has the command, to ask for it and to give it; and the history of all orders."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, HTTPException, Query, Request
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from dashboard.desk import Desk
from dashboard.web.auth import Role
from dashboard.web.front import Asker, asker, desk_of, needs, seat_of
from dashboard.web.pages import render
from dashboard.web.schemas import Line, Strict
from messages.bus.command.watch import name_of
from messages.bus.orders import NoAnswer, OrderError
from messages.contract import gyrofree_pb2 as pb
from messages.text import plain

routes = APIRouter()

SignedIn = Annotated[Asker, Depends(asker)]
Operator = Annotated[Asker, Depends(needs(Role.operator))]
ACTIONS = {
    "take": pb.SeatCommand.ACTION_TAKE,
    "ask": pb.SeatCommand.ACTION_ASK,
    "give": pb.SeatCommand.ACTION_GRANT,
    "keep": pb.SeatCommand.ACTION_DENY,
    "release": pb.SeatCommand.ACTION_RELEASE,
    "force": pb.SeatCommand.ACTION_FORCE,
}
SHOWN = 300


class CommandOut(BaseModel):
    kept: bool = Field(description="somebody keeps the command; else every operator may order")
    may: bool = Field(description="an order of yours would not be refused for want of rights")
    why: str = Field(description="why it would be")
    holder: str = Field(description="who has it, with his place; empty: nobody")
    yours: bool
    since_s: float | None = Field(description="s since 1970")
    asks: str = Field(description="who asks for it")
    asks_id: str
    you_ask: bool
    left_s: float = Field(description="until it passes to who asks, without an answer")
    answer_s: float = Field(description="that a holder has to answer")
    last: str = Field(description="how it came to be as it is")
    admin: bool = Field(description="you may take it from whoever has it")


class CommandIn(Strict):
    action: Literal["take", "ask", "give", "keep", "release", "force"] = Field(
        description="keep: answer no to who asks; release: give it up, or ask no more;"
        " force: take it (admin)"
    )
    to: Line = Field(default="", max_length=64, description="asks_id of whom it is given to")


class OrderOut(BaseModel):
    at_s: float = Field(description="s since 1970")
    user: str
    place: str
    whom: str = Field(description="the recorder, the gateway ...")
    device: str
    what: str
    outcome: str = Field(description="done, refused or no answer")
    text: str = Field(description="the answer, or the reason")
    seconds: float


class OrdersOut(BaseModel):
    orders: list[OrderOut] = Field(description="newest first")
    message: str = Field(description="what is not whole about it")


def _desk(request: Request, who: Asker) -> Desk:
    desk = desk_of(request, who)
    if desk is None:
        raise HTTPException(503, "this dashboard has no connection to the bus")
    return desk


def state_out(desk: Desk | None, seat: pb.Seat, role: Role) -> CommandOut:
    """How it is for one sign-in; without a bus nobody keeps the command."""
    status, operator = None if desk is None else desk.status, role >= Role.operator
    barred = "" if desk is None else desk.barred()
    why = barred if operator else "orders take the role operator; you look as viewer"
    now = status or pb.CommandStatus()
    return CommandOut(
        kept=status is not None,
        may=not why,
        why=why,
        holder=name_of(now.holder) if now.holder.id else "",
        yours=bool(now.holder.id) and now.holder.id == seat.id,
        since_s=now.since_utc_ns * 1e-9 if now.since_utc_ns else None,
        asks=name_of(now.asks) if now.asks.id else "",
        asks_id=now.asks.id,
        you_ask=bool(now.asks.id) and now.asks.id == seat.id,
        left_s=now.left_s,
        answer_s=now.answer_s,
        last=plain(now.last, 300),
        admin=role >= Role.admin,
    )


def orders_out(desk: Desk, text: str, most: int) -> OrdersOut:
    """The history as JSON."""
    found, message = desk.history(text, most)
    rows = [
        OrderOut(
            at_s=one.at_utc_ns * 1e-9,
            user=plain(one.user),
            place=plain(one.place),
            whom=plain(one.whom),
            device=one.device,
            what=plain(one.what, 200),
            outcome=outcome_of(one.outcome),
            text=plain(one.text, 600),
            seconds=one.seconds,
        )
        for one in found
    ]
    return OrdersOut(orders=rows, message=plain(message, 600))


def outcome_of(outcome: int) -> str:
    """Its word."""
    names = pb.OrderGiven.Outcome.keys()
    name = names[outcome] if 0 <= outcome < len(names) else "OUTCOME_NONE"
    return name.removeprefix("OUTCOME_").replace("_", " ").lower()


@routes.get("/api/command", summary="Who has the command, and whether you may order")
def command(request: Request, who: SignedIn) -> CommandOut:
    desk, seat = desk_of(request, who), seat_of(request, who)
    if desk is not None and who.role >= Role.operator:
        desk.seen()
    return state_out(desk, seat, who.role)


@routes.post("/api/command", summary="Take, ask for, give or release the command (operator)")
def change(request: Request, body: CommandIn, who: Operator) -> CommandOut:
    desk, seat = _desk(request, who), seat_of(request, who)
    if body.action == "force" and who.role < Role.admin:
        raise HTTPException(403, "to take the command from somebody takes the role admin")
    desk.seen()
    try:
        desk.command(ACTIONS[body.action], body.to)
    except NoAnswer as error:
        raise HTTPException(503, str(error)) from None
    except OrderError as error:
        raise HTTPException(409, str(error)) from None
    return state_out(desk, seat, who.role)


@routes.get("/api/orders", summary="Orders that were given, with what came of each; newest first")
def orders(
    request: Request,
    who: SignedIn,
    q: Annotated[str, Query(max_length=200)] = "",
    most: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> OrdersOut:
    return orders_out(_desk(request, who), q, most)


@routes.get("/orders", include_in_schema=False)
def page(
    request: Request, who: SignedIn, q: Annotated[str, Query(max_length=200)] = ""
) -> HTMLResponse:
    found = orders_out(_desk(request, who), q, SHOWN)
    return render(
        request, "orders.html", who, rows=found.orders, message=found.message, q=q, most=SHOWN
    )
