"use strict";
(() => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const words = scene.words;
  const find = (selector) => Array.from(document.querySelectorAll(selector));
  const holder = document.getElementById("canvas");
  const FOV = 35, NEAR = 0.62;
  let view3d = null;

  const isChecked = (kind, name) => {
    const box = document.querySelector(`input.${kind}[data-${kind}="${name}"]`);
    return !box || box.checked;
  };

  // the tool of a site that has fewer layers than the slider stands at its last one
  const last = {};
  for (const item of scene.objects) last[item.site] = Math.max(last[item.site] || 0, item.height);

  const isBelow = (item) => {
    const slider = document.getElementById("height");
    if (!slider || !item.height) return true;
    return item.alone ? item.height === Math.min(Number(slider.value), last[item.site]) : item.height <= Number(slider.value);
  };

  function showObjects() {
    for (const item of scene.objects) {
      const object = view3d.getObjectById(item.id);
      if (object) object.visible = isChecked("layer", item.layer) && (!item.site || isChecked("site", item.site)) && isBelow(item);
    }
    const form = document.getElementById("form");
    if (form) form.hidden = !isChecked("layer", "form");
    document.getElementById("scale").hidden = !isChecked("layer", "scan") || !document.querySelector("[data-layer=scan]");
    view3d.render();
  }

  const length = (a) => Math.hypot(...a);
  const add = (a, b, factor) => a.map((value, k) => value + factor * b[k]);
  const whole = length(scene.size);

  function placeCamera(target, radius, direction, up) {
    const narrow = Math.max(holder.clientHeight / holder.clientWidth, 1);
    const eye = add(target, direction, narrow * radius / Math.sin(FOV * Math.PI / 360));
    return [...eye, ...target, ...up];
  }

  function viewFrom(axis) {
    const ways = { iso: scene.start, x: [1, 0, 0], y: [0, -1, 0], z: [0, 0, 1] };
    const way = ways[axis], size = length(way);
    return placeCamera([0, 0, 0], whole * 0.9, way.map((x) => x / size), axis === "z" ? [0, 1, 0] : [0, 0, 1]);
  }

  let flight = 0;
  function flyTo(goal) {
    const from = view3d.getWorld().controls, camera = view3d.getWorld().camera;
    const start = [...camera.position.toArray(), ...from.target.toArray(), ...camera.up.toArray()];
    const number = ++flight, calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const began = performance.now(), time = calm ? 0 : 450;
    const step = (now) => {
      if (number !== flight) return;
      const share = time ? Math.min((now - began) / time, 1) : 1, soft = share * share * (3 - 2 * share);
      view3d.setCamera(start.map((value, k) => value + soft * (goal[k] - value)));
      view3d.render();
      if (share < 1) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  function chooseRow(site) {
    for (const row of find("#sites tbody tr")) row.classList.toggle("chosen", row.dataset.site === String(site));
  }

  function flyToSite(site) {
    const at = scene.sites[site];
    chooseRow(site);
    if (!view3d) return;
    const centre = at.centre.map((value, k) => value - scene.origin[k]);
    const radius = Math.max(at.radius / NEAR, whole * 0.02);
    flyTo(placeCamera(centre, radius, at.direction, at.up));
  }

  function clip() {
    const axis = document.getElementById("clip-axis").value, slider = document.getElementById("clip-at");
    const text = document.getElementById("clip-text");
    slider.disabled = axis === "";
    if (axis === "") {
      text.textContent = "";
      view3d.setClippingPlanes([]);
    } else {
      const k = Number(axis), at = Number(slider.value) * scene.size[k] * 1.01;
      const sign = document.getElementById("clip-flip").checked ? 1 : -1;
      const plane = [0, 0, 0, -sign * at];
      plane[k] = sign;
      text.textContent = `${"xyz"[k]} = ${(at + scene.origin[k]).toPrecision(4)} ${scene.unit}`;
      view3d.setClippingPlanes([plane]);
    }
    view3d.render();
  }

  // the snapshot has the part as designed at time 0, and with its displacement times the slider's end there
  function exaggerate() {
    const slider = document.getElementById("exaggerate"), factor = Number(slider.value);
    const said = { 0: words["as designed"], 1: words["as it is"] }[factor] || words["{factor} times"].replace("{factor}", factor);
    document.getElementById("exaggerate-text").textContent = said;
    return view3d.setTime(factor).then(showObjects);
  }

  function sayLayers() {
    const slider = document.getElementById("height"), done = {};
    for (const item of scene.objects) {
      if (item.minutes !== undefined && item.height <= Number(slider.value)) done[item.site] = item.minutes;
    }
    const sites = Object.keys(done), times = sites.map((site) => (sites.length > 1 ? `${words["site {number}:"].replace("{number}", site)} ` : "") + `${done[site]} min`);
    const upTo = (slider.value === slider.max ? words["all {count}"] : words["1 to {last} of {count}"])
      .replace("{last}", slider.value).replace("{count}", slider.max);
    document.getElementById("height-text").textContent = `${upTo} · ${times.join(", ")}`;
  }

  function listen() {
    for (const box of find("input.layer, input.site")) box.addEventListener("change", showObjects);
    for (const id of ["clip-axis", "clip-flip", "clip-at"]) document.getElementById(id).addEventListener("input", clip);
    const slider = document.getElementById("height");
    if (slider) {
      slider.addEventListener("input", () => {
        sayLayers();
        showObjects();
      });
      sayLayers();
    }
    const form = document.getElementById("exaggerate");
    if (form) form.addEventListener("input", exaggerate);
    document.getElementById("fit").addEventListener("click", () => { chooseRow(0); flyTo(viewFrom("iso")); });
    for (const button of find("button.from")) button.addEventListener("click", () => flyTo(viewFrom(button.dataset.from)));
    const siteOf = Object.fromEntries(scene.objects.filter((item) => item.site).map((item) => [item.id, item.site]));
    view3d.on(view3d.events.OBJECT_CLICKED, (hit) => {
      const site = siteOf[hit.K3DIdentifier];
      if (!site) return;
      chooseRow(site);
      document.getElementById(`row-${site}`).scrollIntoView({ block: "nearest", behavior: "smooth" });
    });
  }

  function listenToRows() {
    for (const row of find("#sites tbody tr")) {
      row.addEventListener("click", (event) => { if (event.target.tagName !== "INPUT") flyToSite(row.dataset.site); });
      row.addEventListener("keydown", (event) => { if (event.key === "Enter") flyToSite(row.dataset.site); });
    }
    for (const button of find("button.fly")) {
      button.addEventListener("click", () => {
        flyToSite(button.dataset.site);
        document.getElementById("view3d").scrollIntoView({ behavior: "smooth" });
      });
    }
  }

  function followTheme() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const set = () => { view3d.setClearColor(dark.matches ? 0x1d2327 : 0xfafbfc); view3d.render(); };
    dark.addEventListener("change", set);
    set();
  }

  async function start() {
    const bytes = Uint8Array.from(atob(document.getElementById("snapshot").textContent), (c) => c.charCodeAt(0));
    view3d = await new window.k3d.CreateK3DAndLoadBinarySnapshot(bytes, holder);
    view3d.setCamera(viewFrom("iso"));
    listen();
    showObjects();
    if (scene.exaggerate) await exaggerate();
    followTheme();
    const wanted = /^#site-(\d+)$/.exec(location.hash);
    if (wanted && scene.sites[wanted[1]]) flyToSite(wanted[1]);
    window.report = { view3d, scene };
    document.body.dataset.ready = "yes";
  }

  // paper has no summary to click on
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = find("details:not([open])");
    for (const block of closed) block.open = true;
  });
  addEventListener("afterprint", () => { for (const block of closed) block.open = false; });

  listenToRows();
  start().catch((error) => {
    document.getElementById("failed3d").hidden = false;
    document.body.dataset.ready = "no";
    console.warn("no 3D view: " + error);
  });
})();
