/* Search of the built pages without a server: browsers start no worker from a file, so this runs it in a hidden frame.
   It has the part of the interface of a Worker that the search uses. Pages from a server keep the browser's own. */
if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.loaded = new Promise((done, failed) => {
        this.frame.prepare = (inside) => {
          inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
          inside.importScripts = (...names) =>
            names.reduce(
              (before, name) =>
                before.then(
                  () =>
                    new Promise((next, stop) => {
                      const script = inside.document.createElement("script");
                      Object.assign(script, { src: name, onload: next, onerror: stop });
                      inside.document.body.appendChild(script);
                    }),
                ),
              Promise.resolve(),
            );
          inside.addEventListener("load", done);
          inside.addEventListener("error", failed);
        };
      });
      document.body.appendChild(this.frame);
      const page = this.frame.contentDocument;
      page.open();
      page.write(
        `<body><script>frameElement.prepare(window)<\/script><script src="${new URL(url, location.href)}"><\/script></body>`,
      );
      page.close();
    }

    postMessage(data) {
      this.loaded.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
