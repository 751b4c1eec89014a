"""The bench of the AXI shell: cocotbext-axi, written by others from AMBA's specification, on its buses."""
