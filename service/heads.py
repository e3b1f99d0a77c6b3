"""HEAD wherever GET is: the head of the same answer, without its body."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Heads:
    """Serve a HEAD as the GET of its address, if it has one."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not _is_of_a_get(scope):
            await self._app(scope, receive, send)
            return
        scope["method"] = "GET"

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.start":
                # as it came, for the server, which then expects no body, and for the log
                scope["method"] = "HEAD"
                await send(message)
                # the server takes it for the end, and tells what would stream that nobody listens
                await send({"type": "http.response.body", "body": b""})

        await self._app(scope, receive, send_head)


def _is_of_a_get(scope: Scope) -> bool:
    is_head = scope["type"] == "http" and scope["method"] == "HEAD"
    return is_head and "GET" in scope["app"].state.addresses.methods_of(scope["path"])
