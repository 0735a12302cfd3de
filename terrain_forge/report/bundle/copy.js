// The page's copy buttons: a click puts the commands, without their comments, on the clipboard.
for (const button of document.querySelectorAll(".command button")) {
  button.hidden = false;
  button.addEventListener("click", async () => {
    const code = button.parentElement.querySelector("code");
    const text = code.textContent.replace(/(^|\s+)#.*$/gm, "").trim();
    try {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
    } catch {
      // Where a browser keeps the clipboard to itself, as on pages without https.
      getSelection().selectAllChildren(code);
      button.textContent = "Ctrl + C";
    }
    setTimeout(() => (button.textContent = "Copy"), 2000);
  });
}
