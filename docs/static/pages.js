// The button for light and dark pages. The theme's own script is a module, which browsers refuse to pages opened from a disk, and fails in Debian's copy.
document.addEventListener("DOMContentLoaded", () => {
  const modes = ["auto", "light", "dark"];
  for (const button of document.getElementsByClassName("theme-toggle")) {
    button.addEventListener("click", () => {
      const next = modes[(modes.indexOf(document.body.dataset.theme) + 1) % modes.length];
      document.body.dataset.theme = next;
      localStorage.setItem("theme", next);
    });
  }
});
