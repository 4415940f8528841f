// What the page does itself: rays of clicks, keys, and files that are dropped on it.
window.damageest_page = {
  install() {
    const view = () => window.trame.refs.view;
    let pressed = [0, 0];
    const tools = {
      press(event) {
        pressed = [event.clientX, event.clientY];
      },
      // a click into the 3D view, as the server needs it; a drag turns the view and is no click
      click(event) {
        if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
        const box = event.currentTarget.getBoundingClientRect();
        window.trame.trigger("pick", [{
          x: (2 * (event.clientX - box.left)) / box.width - 1,
          y: 1 - (2 * (event.clientY - box.top)) / box.height,
          aspect: box.width / box.height,
          camera: view().getCamera(),
        }]);
      },
      // a click into a drawing, from 0 to 1, from the left and from the top
      place(event) {
        const svg = event.currentTarget.querySelector("svg");
        if (!svg) return null;
        const box = svg.getBoundingClientRect();
        return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      },
      async send(files) {
        for (const file of files) {
          const answer = await fetch("/upload?name=" + encodeURIComponent(file.name), { method: "POST", body: file });
          if (!answer.ok) window.trame.trigger("refused", [await answer.text()]);
        }
      },
    };
    window.trame.utils.damageest = tools;
    const keys = {
      1: "open", 2: "prepare", 3: "align", 4: "judge", 5: "repair", 6: "several",
      r: "run", f: "frame", n: "next", p: "previous", a: "accept", d: "drop", j: "job", "?": "help", Escape: "stop",
    };
    window.addEventListener("keydown", (event) => {
      if (/^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName) && event.target.type !== "range") return;
      if (document.querySelector(".v-overlay--active")) return; // a list or a dialog has its own keys
      const command = event.ctrlKey || event.metaKey;
      let name = command ? { z: event.shiftKey ? "redo" : "undo", Z: "redo", y: "redo" }[event.key] : keys[event.key];
      if (!name || event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      window.trame.trigger("key", [name]);
    }, true);
    // a fault of the server while it answered a click: without this, nothing would be seen of it
    window.addEventListener("unhandledrejection", (event) => {
      const why = event.reason || {};
      const words = (why.data && why.data.exception) || why.message || String(why);
      window.trame.trigger("refused", [`unexpected fault: ${words}. The job file is as the last change left it`]);
    });
    window.addEventListener("dragover", (event) => event.preventDefault());
    window.addEventListener("drop", (event) => {
      event.preventDefault();
      if (event.dataTransfer) tools.send(event.dataTransfer.files);
    });
  },
};
