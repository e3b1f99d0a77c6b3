"""tus-js-client 4.3.1, the library that others send with, goes on where a line broke, also after a reload."""

import base64
import hashlib
from pathlib import Path

from tests.support.browser import sign_in, visit
from tests.support.frames import write_frame
from tests.support.line import line_to

CODE = Path(__file__).with_name("tus-js-client-4.3.1.min.js")
SHA256 = "8cbb1b63fccc3bba0ae73ad1deb160ce046c3750851d0c3e94921ae3ef070eb8"
# as its README begins an upload, or takes one up that an earlier visit began
BEGIN = """async ([content, metadata, delays]) => {
    const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
    const file = new File([bytes], metadata.filename, { lastModified: 1 });
    const headers = { "X-CSRF-Token": document.querySelector("meta[name=csrf-token]").content };
    return new Promise(async (done) => {
        const upload = new tus.Upload(file, {
            endpoint: "/v1/uploads", retryDelays: delays, metadata, headers,
            onError: (error) => done({ error: String(error) }),
            onSuccess: ({ lastResponse }) => done({ frame: lastResponse.getHeader("Content-Location") }),
        });
        const earlier = await upload.findPreviousUploads();
        if (earlier.length) upload.resumeFromPreviousUpload(earlier[0]);
        upload.start();
    });
}"""


def test_tus_js_client_goes_on_where_it_was_cut(browser, service, team, tmp_path):
    assert hashlib.sha256(CODE.read_bytes()).hexdigest() == SHA256
    content = write_frame(tmp_path / "level-1.DNG", shape=(1000, 1500)).read_bytes()
    campaign = team.campaign()
    metadata = {"campaign_id": campaign.id, "role": "light", "scene": "level-1", "filename": "Straße 1.DNG"}
    with line_to(service.url) as line, visit(browser, line.url) as context:
        page = sign_in(context, team.key, at="/")
        pieces = []
        page.on("request", lambda asked: asked.method == "PATCH" and pieces.append(asked.headers))

        def begin(delays):
            page.reload()
            page.evaluate(CODE.read_text())
            return page.evaluate(BEGIN, [base64.b64encode(content).decode(), metadata, delays])

        line.cut_after, line.stays_cut = line.passed + len(content) // 2, True
        assert "error" in begin([10])
        assert line.cuts > 1
        line.cut_after = line.passed + len(content) // 4
        line.stays_cut = False
        told = begin([10, 10, 10])
        offsets = [int(each["upload-offset"]) for each in pieces]
        assert offsets[0] == 0
        # what had arrived is not sent again, by the next visit either
        assert offsets[1:]
        assert min(offsets[1:]) > 0
        context.complaints.clear()  # the browser notes what was lost
    with team.http() as http:
        frame = http.get(told["frame"]).json()
        assert frame["filename"] == metadata["filename"]
        assert http.get(f"{told['frame']}/content").content == content
