"""The least that can answer: a FastAPI route that has its JSON in memory, and asks nobody who is asking."""

import json
import sys

import uvicorn
from fastapi import FastAPI
from fastapi.responses import JSONResponse


def main(port: int, body: str) -> None:
    """Serve one answer under every camera's id."""
    app, content = FastAPI(), json.loads(body)

    @app.get("/v1/cameras/{camera_id}/coefficients")
    async def get_coefficients(camera_id: str, method: str) -> JSONResponse:  # noqa: ARG001  read, as there
        return JSONResponse(content)

    uvicorn.run(app, port=port, log_config=None, access_log=False, server_header=False)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.stdin.read())
