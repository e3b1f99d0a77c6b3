"""An export that is verified as it is, or after something in it was changed."""

import json

from verify.__main__ import main


def run(capsys, folder, stated="certificate.json"):
    """The exit code, and what was said without its line breaks."""
    code = main([str(folder / stated), "--data", str(folder)])
    return code, " ".join(capsys.readouterr().out.split())


def require_the_same(capsys, folder, stated="certificate.json"):
    code, said = run(capsys, folder, stated)
    assert "NO" not in said
    assert (code, "quantities are the same to the last bit." in said) == (0, True)
    return said


def change(path, edit):
    content = json.loads(path.read_text())
    edit(content)
    path.write_text(json.dumps(content))


def nudge(place, by=1e-6):
    """Change the number at a place by so much of itself."""

    def edit(certificate):
        *path, last = place
        node = certificate
        for name in path:
            node = node[name]
        node[last] *= 1 + by

    return edit
