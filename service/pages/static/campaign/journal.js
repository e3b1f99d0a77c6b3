// Files still to be sent, kept in the browser: a reload or an empty battery loses nothing.

const BUDGET = 4e9;

/** The journal of one campaign. Where the browser keeps nothing (a private window), it forgets with the page. */
export class Journal {
  constructor(campaignId) {
    this.campaignId = campaignId;
    this.kept = 0;
    this.opened = open().catch(() => null);
  }

  /** Everything that was to be sent: {key, name, size, modified, role, scene, sha256, upload?, file?}. */
  async read() {
    const rows = (await this.run("readonly", (store) => store.getAll())) ?? [];
    const own = rows.filter((row) => row.campaignId === this.campaignId);
    this.kept = own.reduce((sum, row) => sum + (row.file ? row.size : 0), 0);
    return own;
  }

  /** The file itself is kept too, up to a few gigabytes in all: then nobody need choose it again. */
  async add(items) {
    for (const item of items) {
      const { key, name, size, modified, role, scene, sha256, upload, file } = item;
      const row = { id: `${this.campaignId} ${key}`, campaignId: this.campaignId, key, name, size, modified, role, scene, sha256, upload };
      const fits = this.kept + size <= BUDGET;
      const stored = fits && (await this.run("readwrite", (store) => store.put({ ...row, file })));
      if (stored) this.kept += size;
      else await this.run("readwrite", (store) => store.put(row));
    }
  }

  /** Where a file's upload goes on; one that is not written down yet is with it then. */
  async note({ key, upload }) {
    const row = await this.run("readonly", (store) => store.get(`${this.campaignId} ${key}`));
    if (row?.key) await this.run("readwrite", (store) => store.put({ ...row, upload }));
  }

  remove(key) {
    return this.run("readwrite", (store) => store.delete(`${this.campaignId} ${key}`));
  }

  async clear(keys) {
    for (const key of keys) await this.remove(key);
  }

  async run(mode, work) {
    const database = await this.opened;
    if (!database) return undefined;
    return new Promise((done) => {
      const transaction = database.transaction("files", mode);
      const asked = work(transaction.objectStore("files"));
      transaction.oncomplete = () => done(asked.result ?? true);
      transaction.onerror = transaction.onabort = (event) => (event.preventDefault(), done(undefined));
    });
  }
}

function open() {
  return new Promise((done, fail) => {
    const asked = indexedDB.open("stilb-uploads", 1);
    asked.onupgradeneeded = () => asked.result.createObjectStore("files", { keyPath: "id" });
    asked.onsuccess = () => done(asked.result);
    asked.onerror = () => fail(asked.error);
  });
}
