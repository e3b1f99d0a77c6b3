// Events of the service as they happen, on one connection of the browser: HTTP/1.1 has six, and sending needs them.

const LOCK = "stilb events";

/**
 * Call `news(hears)` at each event while the page is seen, and once when none comes any more. Of all tabs one listens:
 * where that is another one, where the browser has no locks (plain http) or a proxy holds events back, none comes.
 */
export function listen(address, kind, news) {
  let over = null;
  let hears = false;

  function begin() {
    if (over || document.hidden || !navigator.locks) return;
    const own = (over = new AbortController());
    const { signal } = own;
    const hold = () => new Promise((done) => {
      const source = new EventSource(address);
      const end = () => {
        source.close();
        done();
      };
      source.addEventListener(kind, () => news((hears = true)));
      source.addEventListener("error", () => {
        if (hears) news((hears = false));
        if (source.readyState === EventSource.CLOSED) end();
      });
      signal.addEventListener("abort", end);
    });
    navigator.locks.request(LOCK, { signal }, hold).catch(() => {});
  }
  function end() {
    over?.abort();
    over = null;
    if (hears) news((hears = false));
  }
  const turn = () => (document.hidden ? end() : begin());
  document.addEventListener("visibilitychange", turn);
  begin();
  return () => {
    document.removeEventListener("visibilitychange", turn);
    end();
  };
}
