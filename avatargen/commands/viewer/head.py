"""What viser's page lacks, as lines for its head: our name, fields that wait, a panel for phones and keys.

viser has no settings for these. What is looked for and not found is left as it is.
"""

HEAD = """
<title>avatargen</title>
<style>
  [data-opens]:focus-visible, [role=slider]:focus-visible { outline: 2px solid #228be6; outline-offset: 2px }
  @media (max-width: 36em) {
    [style*="position: fixed"][style*="width: 20em"], [style*="position: fixed"] [style*="width: 20em"] {
      width: 100% !important
    }
  }
</style>
<script>
  // A text field counts when Enter is pressed or it is left, which is when browsers send "change"; until then
  // nobody hears of what is typed.
  addEventListener("input", (event) => {
    if (event.target.matches(".mantine-TextInput-input")) event.stopImmediatePropagation();
  }, true);

  // What opens and closes by a click does so by a key, too.
  addEventListener("keydown", (event) => {
    if (!["Enter", " "].includes(event.key) || !event.target.matches("[data-opens]")) return;
    event.preventDefault();
    event.target.click();
  });

  const opens = (element, open) => {
    Object.assign(element, { tabIndex: 0, role: "button", ariaExpanded: open });
    element.dataset.opens = "";
  };

  new MutationObserver(() => {
    // The panel's bar on a phone: closed at first.
    const bars = '[style*="cursor: pointer"][style*=" height: 3.5em"]:not([role])';
    for (const bar of document.querySelectorAll(bars)) {
      opens(bar, false);
      bar.addEventListener("click", () => { bar.ariaExpanded = bar.ariaExpanded !== "true" });
      bar.click();
    }
    for (const icon of document.querySelectorAll(".tabler-icon-chevron-up, .tabler-icon-chevron-down")) {
      opens(icon.parentElement, icon.matches(".tabler-icon-chevron-up"));
    }
    for (const label of document.querySelectorAll("label[for]")) {
      const thumb = document.getElementById(label.htmlFor)?.querySelector("[role=slider]");
      if (thumb) thumb.ariaLabel = label.textContent;
    }
  }).observe(document, { childList: true, subtree: true });
</script>
"""
