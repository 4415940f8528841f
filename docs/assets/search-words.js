/* A question is searched for by its words that matter: "my scan is in inches" by inches. "scan" and "part" are on every
   page, so they count only where nothing else is left. */
{
  const small =
    "a about an and any are as at be been by can could did do does for from get give had has have how i if in into is it its " +
    "make me must my need no not of on one or our out should so some tell than that the their then there these they this to " +
    "too want was we were what when where which who why will with would you your";
  const left = [small, small + " part parts scan scans"].map((words) => new Set(words.split(" ")));
  const send = window.Worker.prototype.postMessage;
  window.Worker.prototype.postMessage = function (message, ...rest) {
    if (message?.type === 2 && typeof message.data === "string") {
      const words = message.data.split(/\s+/).filter(Boolean);
      for (const set of left) {
        const kept = words.filter((word) => !set.has(word.replace(/[^\p{L}\p{N}]/gu, "").toLowerCase()));
        if (kept.length) message = { ...message, data: kept.join(" ") };
      }
    }
    return send.call(this, message, ...rest);
  };
}
