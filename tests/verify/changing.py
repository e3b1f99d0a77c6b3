"""An export that is verified as it is, or after something in it was changed."""

import json

from verify.__main__ import main


def run(capsys, folder, *more):
    """The exit code, and what was said without its line breaks."""
    code = main([str(folder / "certificate.json"), "--data", str(folder), *more])
    return code, " ".join(capsys.readouterr().out.split())


def change(path, edit):
    content = json.loads(path.read_text())
    edit(content)
    path.write_text(json.dumps(content))


def nudge(place):
    """Change the number at a place in its last bits."""

    def edit(certificate):
        *path, last = place
        node = certificate
        for name in path:
            node = node[name]
        node[last] = node[last] * (1 + 1e-15) + 1e-15

    return edit
